"""Robot motion: kinematics, limits and windows of joint trajectory."""
