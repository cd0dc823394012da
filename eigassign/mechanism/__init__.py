"""From the case to the affine ERLS pencil K, M of eq. (1), and from paths to trajectories q(t).

Read in this order; each imports only from those above it:

    imports             parts from other programs: matrices, nodes, units
    solids              meshes of solid parts: files, elements, surfaces
    kinematics          the rigid links: tree, joints, twists T(q, y), closed loops
    elements            each link as a finite-element mesh in its own frame: k(y), m(y), N(y)
    assembly            K = Bᵀ k B and M = Bᵀ m B with B = [Q, N T], affine in scalar functions
    inverse_kinematics  the coordinates q along a path of the tip
    trajectory          q(t) from samples, files, points or tip paths
    forces              forces at nodes and the weight, on the unknowns; what drives exert
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "assembly.build": (
            "build_pencil erls_motion local_links refined with_elements with_reduction"
        ),
        "assembly.mode_shapes": "shapes",
        "assembly.pencil": "Pencil",
        "assembly.node_motion": "require_consistent",
        "assembly.dynamics.inertia_forces": "InertiaForces inertia_forces",
        "assembly.dynamics.under_load": "stiffness_under_load",
        "assembly.dynamics.velocity_terms": "velocity_terms",
        "forces": "DriveForces Forces drive_forces",
        "elements.beam": "fields",
        "elements.superelement": "free_part_lines part_lines",
        "elements.links": "total",
        "elements.sections": "section_values",
        "elements.craig_bampton": "factorise kept_factor largest_beside",
        "imports.parts": "imported_part matrix_of read_contents",
        "inverse_kinematics.chain": (
            "Course TipChain TipEvaluation planar_attitude reduced spatial_attitude "
            "tip_chain tip_path"
        ),
        "inverse_kinematics.follow": "follow",
        "kinematics.forward": "Placement build_link_frames",
        "kinematics.joints": "joint_motion turned",
        "kinematics.loop_closure": "all_moving",
        "kinematics.parameters": "parameters resting_pose",
        "kinematics.topology": "JointEdge",
        "solids.mesh_file": "read_mesh",
        "solids.part": "Coupling joined solid_part",
        "trajectory.motion": "Motion Moving TipMotion known_motion timing_law",
        "trajectory.trajectory": (
            "NamedTrajectory Trajectories Trajectory build_trajectory rates read_samples"
        ),
    },
)
