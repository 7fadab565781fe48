"""What belongs to the machine: how columns are laid out, cut, compiled and run, on all its cores.

Rooms above say what is computed for one column; here it becomes a few fast programs for any number
of them, with derivatives and `jax.vmap` as they are cheapest. Whoever has columns that do not see
each other writes a program of a tile of them and enters by `door.enter`, as the solver does and the
operator around it; `batching` takes tile by tile, of as many columns as `sizes` says, and `slopes`
finds their derivatives. Inside, kernels are fenced (`algebra.fenced`) or joined
(`kernels.one_kernel`), and small matrices are multiplied and eliminated (`algebra`,
`elimination`). `plain_jax` switches all of that off, for the same numbers by plain JAX: to settle a
doubt, or where a device or a version of JAX does not suit it. The machine knows no physics.
"""

from .plain import plain_jax as plain_jax
