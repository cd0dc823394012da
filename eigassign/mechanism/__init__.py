"""From the case to the affine ERLS pencil K, M of eq. (1), and from paths to trajectories q(t).

Read in this order; each imports only from those above it:

    kinematics          the rigid links: tree, joints, twists T(q, y), closed loops
    elements            each link as a finite-element mesh in its own frame: k(y), m(y), N(y)
    assembly            K = Bᵀ k B and M = Bᵀ m B with B = [Q, N T], affine in scalar functions
    inverse_kinematics  the coordinates q along a path of the tip
    trajectory          q(t) from samples, files, points or tip paths
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "assembly.build": "build_pencil local_links whole_links with_elements with_reduction",
        "assembly.congruence": "LocalLink motion_matrix motion_scalars",
        "assembly.inside_links": "ReducedLinks reduced_links",
        "assembly.mode_shapes": "shapes",
        "assembly.pencil": "Pencil",
        "assembly.rigid_loops": "require_consistent",
        "assembly.velocity_terms": "VelocityTerms fields velocity_terms",
        "elements.beam": "bending_mass bending_shapes",
        "elements.craig_bampton": "coefficients",
        "elements.links": "link_mesh",
        "elements.matrix_file": "read_matrix",
        "elements.mesh": "LinkMesh total",
        "elements.sections": "SectionValues section_values",
        "elements.sparse_factor": "factorise",
        "inverse_kinematics.chain": "TipChain TipEvaluation reduced tip_chain",
        "inverse_kinematics.follow": "RESIDUAL follow",
        "inverse_kinematics.solver": "Trace interpolated",
        "inverse_kinematics.tip_path": (
            "Course TipPath planar_attitude spatial_attitude spline straight"
        ),
        "kinematics.forward": "Kinematics Placement",
        "kinematics.joints": "JointMotion joint_motion turned",
        "kinematics.link_frames": "LinkFrames build_link_frames",
        "kinematics.loop_closure": "all_moving",
        "kinematics.parameters": "ModelParameters initial_design node_position parameters",
        "kinematics.rotations": "cross multiply rotation vector",
        "kinematics.topology": "GROUND JointEdge Topology",
        "kinematics.travel_limits": "resting_pose",
        "trajectory.csv": "read_samples",
        "trajectory.timing": "POLYNOMIALS timing_law trapezoidal",
        "trajectory.trajectory": (
            "NamedTrajectory Rates Trajectories Trajectory build_trajectory rates"
        ),
    },
)
