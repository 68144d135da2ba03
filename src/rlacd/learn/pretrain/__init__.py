"""Self-supervised weights for the I2P-MAE encoder: hide most of a point cloud, and learn to reconstruct it."""
