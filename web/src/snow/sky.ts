// The light above the stack: a sun at its angle, or an overcast sky.
import { colour, fitCanvas } from "../dom";
import type { Sample } from "../messages";

export function drawSky(canvas: HTMLCanvasElement, sample: Sample): void {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (width === 0 || height === 0) return;
  const context = fitCanvas(canvas, width, height);
  const ink = colour("--muted");
  const centre = width / 2;
  context.lineWidth = 2;
  if ("diffuse" in sample.illumination) {
    canvas.setAttribute("aria-label", "Light from an overcast sky, from all sides alike");
    context.strokeStyle = ink;
    for (let i = 0; i < 9; i++) {
      const angle = ((i - 4) / 4.6) * (Math.PI / 2);
      const [dx, dy] = [Math.sin(angle), Math.cos(angle)];
      arrow(context, centre + dx * height * 0.95, height - 3 - dy * height * 0.8, centre + dx * 12, height - 3 - dy * 10);
    }
    return;
  }
  const degrees = sample.illumination.incidence_angle_deg;
  canvas.setAttribute("aria-label", `Sun at ${degrees} degrees from the normal`);
  const angle = (degrees / 180) * Math.PI;
  const reach = Math.min(width / 2 - 14, (height - 14) / Math.max(0.15, Math.cos(angle)));
  const [sx, sy] = [centre - Math.sin(angle) * reach, Math.max(12, height - 2 - Math.cos(angle) * reach)];
  context.setLineDash([3, 4]);
  context.strokeStyle = ink;
  context.beginPath();
  context.moveTo(centre, 4);
  context.lineTo(centre, height);
  context.stroke();
  context.setLineDash([]);
  context.fillStyle = context.strokeStyle = colour("--sun");
  arrow(context, sx, sy, centre, height - 2);
  context.beginPath();
  context.arc(sx, sy, 9, 0, 2 * Math.PI);
  context.fill();
}

function arrow(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  const angle = Math.atan2(y1 - y0, x1 - x0);
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  for (const side of [-1, 1]) {
    context.moveTo(x1, y1);
    context.lineTo(x1 - 7 * Math.cos(angle + side * 0.5), y1 - 7 * Math.sin(angle + side * 0.5));
  }
  context.stroke();
}
