"""The modulation transfer function of a camera, from a photograph of one straight edge (ISO 12233)."""

from camviz_clinic.measuring.sharpness.slanted_edge import SlantedEdge

__all__ = ["SlantedEdge"]
