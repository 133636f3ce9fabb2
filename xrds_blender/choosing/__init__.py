"""Which mode, quality and samples: what is requested becomes what is rendered."""
