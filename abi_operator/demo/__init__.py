"""A scene to begin with: the inputs of a simulation, made up and written to disk.

`write_demo` draws a coast like southern California's in a Santa Ana wind, with stratocumulus at
sea and the smoke of three fires, and writes what a user would bring: the output of a weather
model, MODIS albedo, a picture of the smoke and a table of the fires, in the layouts of WRF, of
AppEEARS, of PNG and of CSV.
"""

from .write import DemoInputs as DemoInputs
from .write import write_demo as write_demo
