"""Scenes: from a weather model's output to a scenario, its columns, and their simulated image.

`scenario` specifies one time of a scene: it completes the columns of a model Dataset to the top of
the atmosphere and adds ground, sun, satellite and plumes. `column_states` makes of it, or of a
result that is read back, the states that the operator takes. `simulate` adds the reflectances, and
`run` does so for scenes that do not fit into memory. No file is opened here.
"""

from .account import add_accounts as add_accounts
from .albedo import check_ground as check_ground
from .column_air import completion_heights as completion_heights
from .column_air import highest_top as highest_top
from .columns import column_states as column_states
from .liquid import DropletNumber as DropletNumber
from .run import row_blocks as row_blocks
from .run import run as run
from .scenario import GOES_EAST as GOES_EAST
from .scenario import scenario as scenario
from .simulate import simulate as simulate
from .species import PlumeSpecification as PlumeSpecification
from .species import species_of as species_of
