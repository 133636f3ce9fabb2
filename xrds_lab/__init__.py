"""What makes XRDS: training, measuring, demonstrations. Never shipped."""
