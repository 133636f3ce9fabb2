"""A gallery of small shots that judges whether accumulation is ever worse."""
