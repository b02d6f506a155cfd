"""The paper's experiments run one by one, and a page that says which of its claims hold."""

from mjhill.report.catalogue import CATALOGUE as CATALOGUE
from mjhill.report.catalogue import Entry as Entry
from mjhill.report.catalogue import Part as Part
from mjhill.report.catalogue import select as select
from mjhill.report.page import report_of as report_of
from mjhill.report.page import write_report as write_report
from mjhill.report.runner import Outcome as Outcome
from mjhill.report.runner import reproduce as reproduce
