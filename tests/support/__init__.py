"""Oracle, strategies and cases that several tests share."""
