"""inverse_kinematics."""
