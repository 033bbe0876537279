"""Views: each is a frozen state of one visualizer, with pure methods from that state to a picture."""
