r"""A whole image at once: neighbours are alike, and what one measures tells of the others.

With z, x whitened by the prior of single pixels (`inverse`), each of its elements is a field over
the pixels, of which the prior is one of Matern's with smoothness 1: its precision over a grid is

.. math:: Q = D\,(1 - \ell^2 \Delta)^2 D

(F. Lindgren, H. Rue and J. Lindstrom [1]_, section 2.2), with the Laplacian :math:`\Delta` over
neighbours in x and y, the correlation length :math:`\ell` in pixels, at which the correlation has
fallen to 0.60 (0.58 on a grid of three pixels a length), and D diagonal such that the variance of
every pixel is 1: single pixels keep their own prior, alone and at an edge as amid a large image.
Next to pixels that are not retrieved the slope of D z is zero.

Minimised is the sum over all pixels,

.. math:: \sum_p |r_p(z_p)|^2 + \sum_k z_k^T Q z_k,

by steps of Gauss and Newton, in which each pixel is damped where it is far from linear, from the
solutions of single pixels. As each pixel's residuals depend on its own z alone, :math:`J^T J` is a
small block for each of them, and :math:`A = J^T J + Q` is never stored: conjugate gradients
(lineax), preconditioned by A's diagonal blocks, ask for products with it.

The diagonal blocks of the posterior covariance :math:`A^{-1}` are estimated from draws s of it,

.. math:: A s = J^T \epsilon + D (1 - \ell^2 \Delta) \eta, \qquad
   A^{-1}_{pp} \approx A_{pp}^{-1} + \overline{m_p m_p^T}, \qquad
   m_p = -A_{pp}^{-1} (A s - A_{pp} s)_p,

where of each draw only the mean of a pixel given its neighbours is used (P. Siden et al. [2]_).

References
----------
.. [1] "An explicit link between Gaussian fields and Gaussian Markov random fields: the stochastic
   partial differential equation approach", J. R. Stat. Soc. B, 73, 423-498, 2011,
   doi:10.1111/j.1467-9868.2011.00777.x
.. [2] "Efficient covariance approximations for large sparse precision matrices", J. Comput. Graph.
   Stat., 27, 898-909, 2018, doi:10.1080/10618600.2018.1473782
"""

from .linear import Linearised as Linearised
from .linear import joint_cost as joint_cost
from .linear import joint_gradient as joint_gradient
from .linear import linearised as linearised
from .precision import Smoothness as Smoothness
from .precision import smoothness as smoothness
from .retrieval import retrieve_smooth as retrieve_smooth
from .system import NUM_DRAWS as NUM_DRAWS
