"""Pictures: drawn from a run, without a display; `style` is their one look."""
