"""The paper's experiments run one by one, and a page that says which of its claims hold."""

from mjhill.reproduction.catalogue import CATALOGUE as CATALOGUE
from mjhill.reproduction.catalogue import Entry as Entry
from mjhill.reproduction.catalogue import Part as Part
from mjhill.reproduction.catalogue import select as select
from mjhill.reproduction.report import report_of as report_of
from mjhill.reproduction.report import write_report as write_report
from mjhill.reproduction.runner import Outcome as Outcome
from mjhill.reproduction.runner import reproduce as reproduce
