"""All cases, in the order in which they run; a new one is a file here and a line below."""

from .a1_square import FAR, NEAR
from .a2_hexagonal_room import CASE as HEXAGON
from .a3_sphere import CASE as SPHERE
from .a4_cylinder import CASE as CYLINDER
from .b_penumbra import CASE as PENUMBRA
from .c2_cavity import BRIGHT, DARK
from .c3_room import SURFACES, WORKPLANE
from .d1_daylight import ROOF_CLEAR, ROOF_OVERCAST, WINDOW_CLEAR, WINDOW_OVERCAST
from .d2_window import CASE as WINDOW
from .d2_window import CLEAR as CLEAR_WINDOW
from .d3_sun import CASE as SUN
from .f_conference import CASE as CONFERENCE
from .g_pendant import CASE as PENDANT

CASES = (
    NEAR,
    FAR,
    HEXAGON,
    SPHERE,
    CYLINDER,
    PENUMBRA,
    DARK,
    BRIGHT,
    WORKPLANE,
    SURFACES,
    WINDOW_OVERCAST,
    WINDOW_CLEAR,
    ROOF_OVERCAST,
    ROOF_CLEAR,
    WINDOW,
    CLEAR_WINDOW,
    SUN,
    CONFERENCE,
    PENDANT,
)
