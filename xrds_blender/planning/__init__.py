"""What to render, compute and leave out: pure functions of facts."""
