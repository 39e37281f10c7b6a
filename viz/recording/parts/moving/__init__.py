"""What moves in 3D, of every frame that the eye needs."""
