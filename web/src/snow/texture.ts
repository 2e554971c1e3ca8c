// A picture of a layer for the stack: grains as many and as large as its numbers say, in
// rough proportion.
import type { Layer } from "../messages";
import { microgramsPerGram } from "./absorber";

export function drawLayer(context: CanvasRenderingContext2D, layer: Layer, width: number, height: number): void {
  const soot = layer.black_carbon?.concentration_ng_g ?? 0;
  // Dust absorbs some 200 times less than carbon of the same mass.
  const dust = (layer.absorber ?? []).reduce((sum, absorber) => sum + 5 * microgramsPerGram(absorber), 0);
  const brown = (layer.brown_carbon?.concentration_ng_g ?? 0) + dust;
  const density = layer.density_kg_m3 ?? layer.wet_density_kg_m3 ?? 275;
  const wet = Math.min(1, (layer.water_saturation ?? layer.water_fraction ?? 0) * 4);
  // 0 for clean snow, 1 for 100 000 ng/g.
  const dirt = (amount: number) => Math.min(1, Math.log10(1 + amount) / 5);
  const light = 96 - 9 * (density / 550) - 34 * dirt(soot) - 12 * dirt(brown);
  // Brown carbon and dust are warm, all else is bluish; greens do not come between.
  const warm = dirt(brown) * (brown > soot ? 1 : 0.3);
  const [hue, saturation] = warm > 0.1 ? [35, 60 * warm] : [210, 25 + 40 * wet];
  context.fillStyle = `hsl(${hue} ${saturation}% ${light}%)`;
  context.fillRect(0, 0, width, height);

  const random = generator(7);
  for (const grain of layer.grain) {
    const [min, max] = grain.size_um
      ? [grain.size_um.min, grain.size_um.max]
      : Array<number>(2).fill((grain.optical_radius_um ?? 3000 / 917 / (grain.ssa_m2_kg ?? 20) * 1000) * 2.5);
    const share = grain.fraction ?? 1 / layer.grain.length;
    const mean = length((min! + max!) / 2);
    const wanted = (share * (density / 550) * width * height) / (mean * mean * 1.6);
    const count = Math.min(900, Math.round(wanted));
    const round = grain.sphericity?.mean ?? 0.8;
    for (let i = 0; i < count; i++) {
      const size = length(min! + (max! - min!) * random());
      const narrow = grain.shape === "hexagonal" ? 0.4 + 0.4 * random() : 0.3 + 0.65 * round;
      context.save();
      context.translate(random() * width, random() * height);
      context.rotate(random() * Math.PI);
      context.beginPath();
      const corners = grain.shape === "hexagonal" ? 6 : grain.facetness.mean > 0.5 ? 8 : 0;
      if (corners === 0) context.ellipse(0, 0, size / 2, (size / 2) * narrow, 0, 0, 2 * Math.PI);
      else
        for (let k = 0; k < corners; k++) {
          const angle = (k / corners) * 2 * Math.PI;
          context.lineTo((size / 2) * Math.cos(angle), (size / 2) * narrow * Math.sin(angle));
        }
      context.closePath();
      context.fillStyle = `hsl(${hue} 30% ${Math.min(100, light + 5)}% / 0.7)`;
      context.strokeStyle = `hsl(${hue} 30% ${light - 22}% / 0.45)`;
      context.lineWidth = 0.7;
      context.fill();
      context.stroke();
      context.restore();
    }
  }
  // Specks of carbon.
  context.fillStyle = "hsl(30 20% 10% / 0.8)";
  const specks = Math.round(dirt(soot + brown) ** 2 * 0.02 * width * height);
  for (let i = 0; i < specks; i++) context.fillRect(random() * width, random() * height, 1.2, 1.2);
}

/// Length of a grain on the screen, px: 3 to 26 for 50 to 3000 um.
function length(um: number): number {
  return Math.max(3, Math.min(26, 3 + 5.6 * Math.log2(Math.max(50, um) / 50) * 0.7));
}

/// The same numbers every time, so that the picture does not flicker.
function generator(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}
