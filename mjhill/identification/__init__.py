"""Parameters of a joint fitted to the literature, or to measurements of one person."""

from mjhill.identification.failure import FitError as FitError
from mjhill.identification.fit import Estimate as Estimate
from mjhill.identification.fit import Identified as Identified
from mjhill.identification.joint_fit import identify as identify
from mjhill.identification.measurement import Measurement as Measurement
from mjhill.identification.measurement import read_measurement as read_measurement
from mjhill.identification.movement import Prediction as Prediction
from mjhill.identification.report import output_files as output_files
from mjhill.identification.report import write as write
