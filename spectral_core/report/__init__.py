"""Results as documents: JSON, and HTML with plots."""
