"""What a computation returns, and how it is written, drawn and read: plain arrays, no dolfinx."""
