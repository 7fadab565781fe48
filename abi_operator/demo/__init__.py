"""A scene to begin with: the inputs of a simulation, made up and written to disk.

`write_demo` draws a coast like southern California's in a Santa Ana wind, with stratocumulus at
sea and the smoke of three fires, and writes what a user would bring: the output of a weather
model, MODIS albedo and a picture of the smoke, in the layouts of WRF, of AppEEARS and of PNG.
"""

from .write import DemoInputs as DemoInputs
from .write import write_demo as write_demo
