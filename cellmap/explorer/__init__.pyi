from .explored import Explored as Explored
from .explored import ExploredScene as ExploredScene
from .family import export_html as export_html
from .serving import Explorer as Explorer
from .serving import explore as explore
from .widget import explorer_widget as explorer_widget
