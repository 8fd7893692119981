"""Readers: folders of tables become scenes that can be solved. What an FMU does not need."""
