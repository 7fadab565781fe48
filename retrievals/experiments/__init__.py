"""Experiments: what a retrieval can do, and under which conditions it no longer can.

Each is a function of a size and a seed that makes up its pixels, retrieves them in float64, and
returns a Dataset with the table and all that its picture is drawn from; beside it stands the
function that draws. `EXPERIMENTS` names them for the command `abi-operator experiment`.
"""

from .colour_of_ground import ash_colour as ash_colour
from .colour_of_ground import draw_ash_colour as draw_ash_colour
from .experiment import Experiment as Experiment
from .independent_truth import draw_independent_truth as draw_independent_truth
from .independent_truth import independent_truth as independent_truth
from .known_albedo import draw_known_albedo as draw_known_albedo
from .known_albedo import known_albedo as known_albedo
from .over_stratus import draw_over_stratus as draw_over_stratus
from .over_stratus import over_stratus as over_stratus
from .saturated_fires import draw_saturated_fires as draw_saturated_fires
from .saturated_fires import saturated_fires as saturated_fires
from .tables import format_table as format_table

EXPERIMENTS = {
    "albedo": Experiment(known_albedo, draw_known_albedo),
    "truth": Experiment(independent_truth, draw_independent_truth),
    "fires": Experiment(saturated_fires, draw_saturated_fires),
    "stratus": Experiment(over_stratus, draw_over_stratus),
    "ash-colour": Experiment(ash_colour, draw_ash_colour),
}
"""By the name that the command knows them by."""
