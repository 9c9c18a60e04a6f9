"""After a fit: which other laws the data allow, and how far their predictions reach."""
