"""A guard on every Jacobian: what the operator gave when last looked at, and what moved since.

A baseline is a NetCDF file with values and Jacobians of every band with respect to every floating
number of a few states, and with what the instrument and products make of the values (`evaluate`,
`write_baseline`, `read_baseline`). `compare` finds the entries that moved by more than their
tolerance and `report` says which; `check` and `accept` do all of it for a file.
`standard_columns` are the project's own states; a scenario of yours is a function that returns
states. The commands are ``abi-operator jacobian save``, ``check`` and ``accept``; tests use the
pytest fixture ``jacobian_guard``.
"""

from .baseline import Baseline as Baseline
from .baseline import read_baseline as read_baseline
from .baseline import write_baseline as write_baseline
from .comparison import INPUT_TOLERANCE as INPUT_TOLERANCE
from .comparison import JACOBIAN_TOLERANCE as JACOBIAN_TOLERANCE
from .comparison import OUTPUT_TOLERANCE as OUTPUT_TOLERANCE
from .comparison import SMALLEST_ELASTICITY as SMALLEST_ELASTICITY
from .comparison import SMALLEST_INPUT as SMALLEST_INPUT
from .comparison import VALUE_TOLERANCE as VALUE_TOLERANCE
from .comparison import Comparison as Comparison
from .comparison import Moved as Moved
from .comparison import compare as compare
from .comparison import excess as excess
from .comparison import select as select
from .evaluation import NUM_DOUBLINGS as NUM_DOUBLINGS
from .evaluation import Jacobians as Jacobians
from .evaluation import Request as Request
from .evaluation import evaluate as evaluate
from .outputs import Outputs as Outputs
from .report import report as report
from .scenario import STANDARD as STANDARD
from .scenario import load_scenario as load_scenario
from .standard import standard_columns as standard_columns
from .workflow import accept as accept
from .workflow import check as check
from .workflow import guard_states as guard_states
from .workflow import save as save
