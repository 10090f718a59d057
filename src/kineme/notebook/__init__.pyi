# Widgets
from kineme.notebook.widgets import Draw as Draw
from kineme.notebook.widgets import Move as Move
