// Explanations and limits of the keys of a sample, from its schema.
import schema from "../../../schema/sample.schema.json";

interface Node {
  description?: string;
  minimum?: number;
  maximum?: number;
  enum?: string[];
  default?: unknown;
  properties?: Record<string, Node>;
  items?: Node;
}

function node(path: string): Node {
  let at: Node | undefined = schema as Node;
  for (const key of path.split(".")) {
    at = at?.properties?.[key];
    if (at?.items?.properties) at = at.items;
  }
  if (!at) throw new Error(`the schema has no key ${path}`);
  return at;
}

/// The explanation of a key such as `layer.grain.size_um`, on one line.
export function help(path: string): string {
  const text = (node(path).description ?? "").replace(/\s+/g, " ").replace(/`/g, "").trim();
  if (!text) throw new Error(`the schema does not explain ${path}`);
  return text;
}

/// Ends of a slider: those of the schema, narrowed to ordinary values where they are given.
export function limits(path: string, ordinary: { min?: number; max?: number } = {}): { min: number; max: number } {
  const { minimum = 0, maximum = 1 } = node(path);
  return { min: Math.max(minimum, ordinary.min ?? minimum), max: Math.min(maximum, ordinary.max ?? maximum) };
}

export function names(path: string): string[] {
  return node(path).enum ?? [];
}

export function standard(path: string): string {
  return String(node(path).default ?? "");
}
