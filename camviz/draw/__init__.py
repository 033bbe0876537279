"""Drawing: arrays in, pictures out. No widget, no kernel and no display is needed."""
