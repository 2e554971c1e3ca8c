"""Look-up tables of `splitsnow export --format lut` in other programs: what OpenEXR, GLSL, HLSL, WGSL
and MaterialX read from them is what the compact file holds.

GLSL, HLSL (compiled to SPIR-V, then translated) and the GLSL that MaterialX generates run in WebGL 2,
WGSL in WebGPU, both in software in headless Chromium. tests/blender/test_lut.py runs OSL in Blender.
"""

import base64
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as mx_gen_glsl
import MaterialX.PyMaterialXGenMdl as mx_gen_mdl
import MaterialX.PyMaterialXGenMsl as mx_gen_msl
import MaterialX.PyMaterialXGenOsl as mx_gen_osl
import MaterialX.PyMaterialXGenShader as mx_gen_shader
import numpy as np
import OpenEXR
import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = os.environ.get("SPLITSNOW_BIN", ROOT / "target/release/splitsnow")
FILE = ROOT / "examples/mitsuba/snow.safetensors"
WHITE = np.array([0.3127 / 0.329, 1, 0.3583 / 0.329])  # of D65
SNOW = ("--facetness=0.3", "--grain-size-um=300", "--density-kg-m3=275")
sys.path[:0] = [str(ROOT / "examples/lut"), str(ROOT / "tests/lut")]
from browser import result_of  # noqa: E402
from table import Table, read_exr  # noqa: E402


def export(out, *options):
    command = [str(PROGRAM), "export", str(FILE), "--format=lut", *SNOW, f"--out={out}", *options]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lut")
    export(folder / "snow")
    return folder


@pytest.fixture(scope="session")
def points():
    """Thicknesses, cm, and cosines: anywhere, outside the table too."""
    random = np.random.default_rng(1)
    cm = np.concatenate([400 * random.random(4000) ** 4, [-1, 0, 0, 1e3, 5]])
    cosine = np.concatenate([random.random(4000), [0.5, -1, 2, 0.9, 1]])
    return cm.astype("f4"), cosine.astype("f4")


def pixels(path):
    """The image as the reference implementation of OpenEXR reads it."""
    with OpenEXR.File(str(path)) as file:
        assert file.header()["compression"] == OpenEXR.NO_COMPRESSION
        channel = file.channels()["RGB"]
        assert channel.pixels.dtype == np.float16
        return channel.pixels.astype(float), file.header()["chromaticities"]


def test_openexr_reads_the_images(folder):
    about = json.loads((folder / "snow.json").read_text())
    for part in ("transmittance", "reflectance"):
        path = folder / about[part]["file"]
        image, chromaticities = pixels(path)
        assert image.shape == (about[part]["height"], about[part]["width"], 3)
        assert np.array_equal(image, read_exr(path))
        assert np.allclose(chromaticities, [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767])


def of_program(table, cm, deg):
    """The colour of `query`, summed here, in the primaries of the table."""
    data = ROOT / "crates/spectra/data"
    observer = np.loadtxt(data / "cie_1931_2deg.csv", delimiter=",", skiprows=2).T
    light = np.loadtxt(data / "illuminant_d65.csv", delimiter=",", skiprows=2).T
    place = (f"--thickness-cm={cm}", f"--incidence-angle-deg={deg}")
    command = [str(PROGRAM), "query", str(FILE), *SNOW, *place]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    nm, share = np.loadtxt(result.stdout.splitlines()[1:], delimiter=",").T
    fine = np.arange(max(nm[0], 360), min(nm[-1], 780) + 1, 5)
    power = np.interp(fine, *light) * np.array([np.interp(fine, observer[0], c) for c in observer[1:]])
    power[:, [0, -1]] /= 2
    relative = (power * np.interp(fine, nm, share)).sum(1) / power.sum(1)
    return np.array(table.about["primaries"]["from_xyz_d65"]) @ (relative * WHITE)


def delta_e(table, first, second, exposed=True):
    """Of colours in the primaries of the table; exposed so that the first has half the luminance of
    white."""
    matrix = np.array(table.about["primaries"]["from_xyz_d65"])
    t = np.array([np.linalg.solve(matrix, colour) / WHITE for colour in (first, second)])
    t *= 0.5 / t[0, 1] if exposed else 1
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    lab = np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], -1)
    return float(np.linalg.norm(lab[0] - lab[1]))


def test_the_table_holds_the_spectra_of_the_program(folder):
    table = Table(folder / "snow.json")
    for cm, deg in [(0.2, 70), (1, 0), (7.3, 33), (30, 60), (60, 10), (100, 0)]:
        found = table.transmittance(cm, np.cos(np.radians(deg)))
        expected = of_program(table, cm, deg)
        assert delta_e(table, expected, found, False) < 0.05, (cm, deg)
        assert delta_e(table, expected, found) < 0.3, (cm, deg)


VERTEX = """#version 300 es
in vec3 i_position;
in vec2 i_texcoord_0;
out vec2 place;
void main() { place = i_texcoord_0; gl_PointSize = 1.0; gl_Position = vec4(i_position, 1.0); }
"""
FRAGMENT = """#version 300 es
@defines@
@look_up@
uniform sampler2D table;
in vec2 place;
out vec4 colour;
void main() { colour = vec4(@call@, 1.0); }
"""
COMPUTE = """
@look_up@
@group(0) @binding(0) var table: texture_2d<f32>;
@group(0) @binding(1) var linear_clamp: sampler;
@group(0) @binding(2) var<storage, read> points: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read_write> colours: array<vec4<f32>>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < arrayLength(&points)) {
        let place = points[id.x];
        colours[id.x] = vec4<f32>(@call@, 1.0);
    }
}
"""


def glsl(folder, call, image, flipped=False):
    defines = "#define SNOW_FIRST_ROW_AT_0 0" if flipped else ""
    look_up = (folder / "snow.glsl").read_text()
    fragment = FRAGMENT.replace("@look_up@", look_up).replace("@call@", call).replace("@defines@", defines)
    return {"vertex": VERTEX, "fragment": fragment, "samplers": {"table": image}, "flipped": flipped}


def wgsl(folder, call, image):
    look_up = (folder / "snow.wgsl").read_text()
    return {"code": COMPUTE.replace("@look_up@", look_up).replace("@call@", call), "image": image}


def compiled(source, path, *options):
    path.write_text(source)
    result = subprocess.run(["glslangValidator", *options, str(path)], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


def hlsl(folder, call, image):
    """Through SPIR-V."""
    source = (folder / "snow.hlsl").read_text() + """
Texture2D table : register(t0);
SamplerState linear_clamp : register(s0);
float4 main(float2 place : TEXCOORD0) : SV_Target { return float4(@call@, 1.0); }
""".replace("@call@", call)
    binary = folder / "main.spv"
    compiled(source, folder / "main.hlsl", "-D", "-V", "-S", "frag", "-e", "main", "-o", str(binary))
    command = ["spirv-cross", "--es", "--version", "300", str(binary)]
    fragment = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    (sampler,) = re.findall(r"uniform highp sampler2D (\w+);", fragment)
    return {"vertex": VERTEX, "fragment": fragment, "samplers": {sampler: image}}


@pytest.mark.parametrize("version", ["130", "330", "460", "300 es"])
def test_glslang_compiles_glsl(folder, tmp_path, version):
    fragment = FRAGMENT.replace("300 es", version).replace("@defines@", "")
    fragment = fragment.replace("@look_up@", (folder / "snow.glsl").read_text())
    call = "snow_transmittance(table, place.x, place.y) + snow_reflectance(table, place.y)"
    compiled(fragment.replace("@call@", call), tmp_path / "look_up.frag")


def document(folder, node):
    """A MaterialX document with the node as the emission of a surface: thickness and cosine are
    texture coordinates."""
    document = mx.createDocument()
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    document.setDataLibrary(library)
    mx.readFromXmlFile(document, str(folder / "snow.mtlx"))
    document.setColorSpace("acescg")
    graph = document.addNodeGraph("graph")
    place = graph.addNode("texcoord", "place", "vector2")
    look_up = graph.addNode(node, "look_up", "color3")
    for name, channel in (("thickness_cm", 0), ("cosine", 1)):
        part = graph.addNode("extract", f"part_{name}", "float")
        part.setConnectedNode("in", place)
        part.setInputValue("index", channel, "integer")
        if document.getNodeDef(f"ND_{node}").getInput(name):
            look_up.addInput(name, "float").setNodeName(part.getName())
    output = graph.addOutput("out", "color3")
    output.setConnectedNode(look_up)
    surface = document.addNode("surface_unlit", "surface", "surfaceshader")
    surface.addInput("emission_color", "color3").setConnectedOutput(output)
    document.addMaterialNode("material", surface)
    valid, message = document.validate()
    assert valid, message
    return document


def generated(folder, node, generator):
    context = mx_gen_shader.GenContext(generator)
    context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
    colours = mx_gen_shader.DefaultColorManagementSystem.create(generator.getTarget())
    made = document(folder, node)
    colours.loadLibrary(made.getDataLibrary())
    generator.setColorManagementSystem(colours)
    surface = made.getNode("surface")
    return generator.generate("snow", surface, context)


@pytest.mark.parametrize("node", ["splitsnow_transmittance", "splitsnow_reflectance"])
@pytest.mark.parametrize(
    "generator",
    [
        mx_gen_glsl.GlslShaderGenerator,
        mx_gen_glsl.VkShaderGenerator,
        mx_gen_osl.OslShaderGenerator,
        mx_gen_mdl.MdlShaderGenerator,
        mx_gen_msl.MslShaderGenerator,
    ],
)
def test_materialx_generates(folder, node, generator):
    shader = generated(folder, node, generator.create())
    source = shader.getSourceCode(mx_gen_shader.PIXEL_STAGE)
    assert f"NG_{node}" in source and "snow" in source


def materialx(folder, node, image):
    shader = generated(folder, node, mx_gen_glsl.EsslShaderGenerator.create())
    identity = np.eye(4).ravel().tolist()
    uniforms = {"u_worldMatrix": identity, "u_viewProjectionMatrix": identity}
    for block in shader.getStage(mx_gen_shader.PIXEL_STAGE).getUniformBlocks().values():
        for port in block:
            if port.getType().getName() in ("float", "integer", "color3"):
                values = port.getValue().getValueString() if port.getValue() else "0"
                kind = port.getType().getName()
                uniforms[port.getVariable()] = [kind, *map(float, values.split(","))]
    vertex, fragment = map(shader.getSourceCode, (mx_gen_shader.VERTEX_STAGE, mx_gen_shader.PIXEL_STAGE))
    sampler = re.findall(r"uniform sampler2D (\w+);", fragment)
    assert len(sampler) == 1, fragment
    return {
        "vertex": vertex.replace("void main()\n{", "void main()\n{\n    gl_PointSize = 1.0;"),
        "fragment": fragment,
        "uniforms": uniforms,
        "samplers": {sampler[0]: image},
        # MaterialX counts v from the bottom
        "flipped": True,
    }


@pytest.fixture(scope="session")
def found(folder, points):
    """Colours by look-up and language."""
    about = json.loads((folder / "snow.json").read_text())

    def texels(part):
        image = read_exr(folder / about[part]["file"])
        rgba = np.concatenate([image, np.ones((*image.shape[:2], 1))], -1).astype("<f2")
        encoded = base64.b64encode(rgba.tobytes()).decode()
        return {"width": rgba.shape[1], "height": rgba.shape[0], "texels": encoded}

    through, back = "snow_transmittance({}place.x, place.y)", "snow_reflectance({}place.y)"
    look_ups = {
        "glsl": glsl(folder, through.format("table, "), "transmittance"),
        "glsl turned over": glsl(folder, through.format("table, "), "transmittance", True),
        "glsl reflectance": glsl(folder, back.format("table, "), "reflectance"),
        "hlsl": hlsl(folder, through.format("table, linear_clamp, "), "transmittance"),
        "hlsl reflectance": hlsl(folder, back.format("table, linear_clamp, "), "reflectance"),
        "wgsl": wgsl(folder, through.format("table, linear_clamp, "), "transmittance"),
        "wgsl reflectance": wgsl(folder, back.format("table, linear_clamp, "), "reflectance"),
        "materialx": materialx(folder, "splitsnow_transmittance", "transmittance"),
        "materialx reflectance": materialx(folder, "splitsnow_reflectance", "reflectance"),
    }
    job = {
        "points": base64.b64encode(np.stack(points, -1).tobytes()).decode(),
        "images": {part: texels(part) for part in ("transmittance", "reflectance")},
        "look_ups": look_ups,
    }
    page = (ROOT / "tests/lut/evaluate.html").read_bytes()
    return result_of("evaluate.html", {"evaluate.html": page}, job)


def check(found, expected):
    assert not isinstance(found, str), found
    found = np.array(found).reshape(-1, 3)
    # samplers count parts of texels in 256ths; red is clipped in thick snow
    assert (np.abs(found - expected) < 2e-3 * expected.max(-1, keepdims=True)).all()


@pytest.mark.parametrize("language", ["glsl", "glsl turned over", "hlsl", "wgsl", "materialx"])
def test_transmittance(found, points, folder, language):
    check(found[language], Table(folder / "snow.json").transmittance(*points))


@pytest.mark.parametrize("language", ["glsl", "hlsl", "wgsl", "materialx"])
def test_reflectance(found, points, folder, language):
    check(found[f"{language} reflectance"], Table(folder / "snow.json").reflectance(points[1]))


def test_three_renders_the_blocks(folder):
    """The page of examples/lut, with three.js from npm, against the compact file."""
    modules = ROOT / "target/lut/node_modules"
    assert (modules / "three").is_dir(), "missing: npm install --prefix target/lut three"
    page = (ROOT / "examples/lut/three.html").read_text()
    page += "<script type=module>window.addEventListener('blocks', () => fetch('/result', { method: 'POST', body: JSON.stringify({ blocks: window.blocks, picture: document.querySelector('canvas').toDataURL() }) }))</script>"
    names = ("snow.json", "snow.glsl", "snow.exr")
    files = {name: folder / name for name in names} | {"three.html": page.encode(), "node_modules": modules}
    answer = result_of("three.html", files)
    table = Table(folder / "snow.json")
    assert [round(block["thickness_cm"] * block["cosine"]) for block in answer["blocks"]] == [5, 10, 15, 30]
    for block in answer["blocks"]:
        deg = np.degrees(np.arccos(block["cosine"]))
        expected = block["cosine"] * of_program(table, block["thickness_cm"], deg)
        error = delta_e(table, expected, np.array(block["colour"]))
        print(f"{block['thickness_cm']:.1f} cm: Delta-E {error:.3f}")
        assert error < 0.5
    picture = base64.b64decode(answer["picture"].partition(",")[2])
    (ROOT / "target/lut/three.png").write_bytes(picture)


def test_vertex_colours(folder, tmp_path):
    """A block of 12 cm lit straight from behind, and one tilted: the baked corners have the colour of
    the table; the faces toward the light are black."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-0.06, 0.06)])
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
    (tmp_path / "block.obj").write_text("\n".join(lines))
    table, script = Table(folder / "snow.json"), ROOT / "examples/lut/bake.py"
    for to_light in ([0, 0, -1], [0.3, 0, -1]):
        out = tmp_path / "block.gltf"
        command = [sys.executable, str(script), str(tmp_path / "block.obj"), str(folder / "snow.json")]
        command += ["--to-light", *map(str, to_light), "--exposure", "100", "--out", str(out)]
        subprocess.run(command, check=True, capture_output=True)
        made = json.loads(out.read_text())
        data = base64.b64decode(made["buffers"][0]["uri"].partition(",")[2])
        place, normal, colour = np.frombuffer(data, "<f4").reshape(3, -1, 3)
        front = normal[:, 2] > 0.5
        cosine = 1 / np.linalg.norm(to_light)
        expected = 100 * cosine * table.transmittance(12 / cosine, cosine) @ table.to_linear_rec709.T
        # rays that leave by the side are shorter
        whole = front & (place[:, 0] < 0)
        assert whole.sum() >= 3
        assert np.allclose(colour[whole], np.maximum(expected, 0), rtol=1e-4, atol=1e-6)
        assert (colour[normal[:, 2] < -0.5] == 0).all()
        assert (colour[front] > 0).any(-1).all()
