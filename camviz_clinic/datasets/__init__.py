"""From photographs to a posed dataset: undistorted pictures of one pinhole, the pose of each, and the files of both."""
