"""Super-resolution: the networks, what they are fed, and how a picture is enlarged."""
