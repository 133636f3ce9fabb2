"""Figures and tables of the pages, out of docs/results: `python -m xrds_lab.pages`."""
