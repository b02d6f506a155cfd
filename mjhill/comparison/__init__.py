"""mjhill's muscle beside MuJoCo's own: matched, run in the same trials, measured and timed."""

from mjhill.comparison.cost import StepCost as StepCost
from mjhill.comparison.cost import step_cost as step_cost
from mjhill.comparison.match import Match as Match
from mjhill.comparison.match import matching as matching
from mjhill.comparison.native import native_model as native_model
from mjhill.comparison.native import native_spec as native_spec
from mjhill.comparison.report import write as write
from mjhill.comparison.table import Comparison as Comparison
from mjhill.comparison.table import Row as Row
from mjhill.comparison.table import check as check
from mjhill.comparison.table import compare as compare
