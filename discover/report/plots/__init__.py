"""Pictures: figures in, SVG text out. The only place that knows matplotlib."""
