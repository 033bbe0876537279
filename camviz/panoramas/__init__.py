"""Wide pictures: cube maps, projections, reprojection, rings of cameras and mirrors."""
