"""Robot motion: kinematics, limits, windows of joint trajectory."""
