"""Widgets: what a reader touches. They hold no mathematics and no drawing."""
