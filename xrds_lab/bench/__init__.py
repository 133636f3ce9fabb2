"""What the product is measured by; not part of the extension."""
