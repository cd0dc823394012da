"""From the case to the affine ERLS pencil: sections, elements, kinematics, assembly, paths."""
