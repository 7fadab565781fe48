"""What belongs to the machine: how columns are laid out, cut, compiled and run, on all its cores.

Rooms above say what is computed for one column; here it becomes a few fast programs for any number
of them, with derivatives and `jax.vmap` as they are cheapest. Whoever has columns that do not see
each other enters by `door.enter`; inside a program `independent_columns` takes them tile by tile
(`batching`), kernels are fenced (`algebra.fenced`) or joined (`kernels.one_kernel`), and small
matrices are multiplied and eliminated (`algebra`, `elimination`). It knows no physics.
"""
