"""Data types shared by all packages; NumPy only."""

from .cad import EDGE_KINDS, CadEdges, Certificate, Face, Model, Part
from .colorimetry import SpectralLight
from .daylight import DaylightFactors, DaylightShares
from .elements import Elements
from .glazing import Glass, Glazing
from .optics import Air, Emitter, Material
from .patch_sky import PatchSky
from .patches import PatchSet
from .photometry import Photometry, Web
from .result import Balance, CameraImage, Result, SensorResult, SurfaceResult
from .scene import BLACK, CONTACT, Luminaire, SceneData, SceneFace, ScenePart, Source
from .sky import CIESky, Ground, PerezSky, Site, Sky, Sun
from .views import Camera, Sensors
from .weather import Weather

__all__ = [
    "BLACK",
    "CONTACT",
    "EDGE_KINDS",
    "Air",
    "Balance",
    "CadEdges",
    "CIESky",
    "Camera",
    "CameraImage",
    "Certificate",
    "DaylightFactors",
    "DaylightShares",
    "Elements",
    "Emitter",
    "Face",
    "Glass",
    "Glazing",
    "Ground",
    "Luminaire",
    "Material",
    "Model",
    "Part",
    "PatchSet",
    "PatchSky",
    "PerezSky",
    "Photometry",
    "Result",
    "SceneData",
    "SceneFace",
    "ScenePart",
    "SensorResult",
    "Sensors",
    "Site",
    "Sky",
    "Source",
    "SpectralLight",
    "Sun",
    "SurfaceResult",
    "Weather",
    "Web",
]
