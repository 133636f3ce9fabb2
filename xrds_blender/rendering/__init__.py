"""From a scene to a picture: settings chosen, frames sampled, finished and written."""
