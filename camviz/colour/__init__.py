"""Colour: spectra of light, things and cameras, and what an eye and a camera make of them."""
