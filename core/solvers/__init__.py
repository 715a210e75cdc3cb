"""Least-squares solvers and robust weights: everything here is linear algebra and knows nothing of views or roads.

- ``gauss_newton``: nonlinear least squares on a sparse Jacobian, with a direct factorisation of the normal equations.
- ``pose_costs``: the paper's residuals on poses, Eqs. (10)-(12), with their Jacobians.
- ``chain``: normal equations of a long chain of small blocks, solved in linear time, and the marginal covariances of the blocks.
- ``robust``: weights that take the say away from outliers.

Begin with ``gauss_newton.gauss_newton`` and ``pose_costs.local_residual``: the pose graph and refinement mode "paper" use nothing
else. ``chain`` is what makes refinement mode "route" linear in the length of the drive.
"""
