"""Scenes and shots to report on: no constant of the product was chosen on them."""
