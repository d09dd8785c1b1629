from .explored import Explored as Explored
from .serving import Explorer as Explorer
from .serving import explore as explore
