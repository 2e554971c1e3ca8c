// The engine in the browser: one worker per core, and a scheduler.
//
// Walks are shared over the workers by index node; the shares of one simulation are then put
// together by one of them, which gives the same bits for any number of workers. Quick
// questions (a check, a colour, a look-up) go to a worker of their own, the desk, so that they
// never wait behind walks. The desk also keeps opened files.
import { concatenate } from "../bytes";
import type { Request, Sample, SampleAnswer, SimulateRequest } from "../messages";
import { RAYS, Refused, STUCK_MS, type AnswerTo, type Engine } from "../page";
import type { FromWorker, WorkerLike } from "./protocol";

/// A worker that is still busy with a superseded request after this time is replaced, ms. Coarse
/// walks are left to finish unless they are stuck, because a new worker has to make its tables anew.
export const PATIENCE_MS = 3000;
/// The same while a simulation waits and no worker is free, ms.
export const IMPATIENCE_MS = 100;
/// What takes longest (a wedge, directions) makes room for a simulation that waits for its worker
/// after this time, ms, and is done again later.
export const ASIDE_MS = 1000;
export const MOST_WORKERS = 8;
/// Workers that may fail at their start, one after the other, before no new one is started.
const MOST_STILLBORN = 20;

type Reply = { json: string; data: Uint8Array | null };

/// All that belongs to one `ask`. Once dropped, its tasks are not started any more.
interface Group {
  dropped: boolean;
}

interface Task {
  group: Group;
  request: Request;
  data: Uint8Array | null;
  /// Lower goes first.
  priority: number;
  /// The only worker that may do it, or null for any. An engine keeps the tables of grain events
  /// of its index nodes, so the same share goes to the same worker.
  place: number | null;
  resolve(reply: Reply): void;
  reject(error: unknown): void;
}

interface Slot {
  worker: WorkerLike;
  task: Task | null;
  id: number;
  since: number;
  replace: ReturnType<typeof setTimeout> | null;
}

class Dropped extends Error {}

export interface PoolOptions {
  /// Makes a worker that has its module already.
  spawn(): WorkerLike;
  workers: number;
  patienceMs?: number;
  impatienceMs?: number;
  asideMs?: number;
}

export class Pool implements Engine {
  readonly #options: Required<PoolOptions>;
  readonly #slots: Slot[] = [];
  readonly #desk: Slot;
  readonly #channels = new Map<string, { group: Group; drop(): void }>();
  #queue: Task[] = [];
  #deskQueue: Task[] = [];
  readonly #nodes = new Map<string, number>();
  /// Workers in a row that failed before they had work.
  #stillborn = 0;
  #ids = 0;
  /// How many workers were replaced, for tests.
  replaced = 0;

  constructor(options: PoolOptions) {
    this.#options = { patienceMs: PATIENCE_MS, impatienceMs: IMPATIENCE_MS, asideMs: ASIDE_MS, ...options };
    for (let i = 0; i < options.workers; i++) this.#slots.push(this.#slot());
    this.#desk = this.#slot();
  }

  get name(): string {
    const n = this.#slots.length;
    return `WebAssembly, ${n} ${n === 1 ? "worker" : "workers"}`;
  }

  async ask<R extends Request>(request: R, data?: Uint8Array): Promise<AnswerTo<R>> {
    return this.#run(request, data ?? null, { dropped: false });
  }

  askLatest<R extends Request>(channel: string, request: R, data?: Uint8Array): Promise<AnswerTo<R> | null> {
    this.#channels.get(channel)?.drop();
    const group: Group = { dropped: false };
    return new Promise((resolve, reject) => {
      const entry = { group, drop: () => this.#drop(group, () => resolve(null)) };
      this.#channels.set(channel, entry);
      const done = () => {
        if (this.#channels.get(channel) === entry) this.#channels.delete(channel);
      };
      this.#run(request, data ?? null, group).then(
        (answer) => {
          done();
          resolve(group.dropped ? null : answer);
        },
        (error) => {
          done();
          if (group.dropped || error instanceof Dropped) resolve(null);
          else reject(error);
        },
      );
    });
  }

  async #run<R extends Request>(request: R, data: Uint8Array | null, group: Group): Promise<AnswerTo<R>> {
    if (request.ask === "simulate" && !data) return (await this.#simulate(request, group)) as AnswerTo<R>;
    const answer = read(await this.#task(request, data, group)) as AnswerTo<R>;
    if (request.ask === "sample") this.#learnNodes(answer as SampleAnswer);
    return answer;
  }

  /// A simulation whose walks are shared over the workers.
  async #simulate(request: SimulateRequest, group: Group): Promise<unknown> {
    const { sample, files, rays, seed } = request;
    const workers = Math.min(this.#slots.length, this.#nodesOf(sample));
    if (workers < 2) return read(await this.#task(request, null, group, 0));
    const shares = await Promise.all(
      Array.from({ length: workers }, async (_, worker) => {
        const reply = await this.#task({ ask: "walk", sample, files, rays, seed, worker, workers }, null, group, worker);
        read(reply);
        return reply.data ?? new Uint8Array(0);
      }),
    );
    return read(await this.#task(request, concatenate(shares), group, 0));
  }

  /// The number of index nodes, as far as it is known without asking: it follows from the
  /// wavelengths, mostly. A share without nodes is empty and does no harm.
  #nodesOf(sample: Sample): number {
    return this.#nodes.get(JSON.stringify(sample.wavelengths)) ?? this.#slots.length;
  }

  #learnNodes({ sample, nodes }: SampleAnswer): void {
    if (this.#nodes.size > 100) this.#nodes.clear();
    this.#nodes.set(JSON.stringify(sample.wavelengths), nodes);
  }

  #task(request: Request, data: Uint8Array | null, group: Group, place: number | null = null): Promise<Reply> {
    return new Promise((resolve, reject) => {
      if (group.dropped) return reject(new Dropped());
      const priority = urgency(request);
      const task = { group, request, data, priority, place, resolve, reject };
      if (priority === 0) this.#deskQueue.push(task);
      else this.#enqueue(task);
      this.#next();
    });
  }

  #enqueue(task: Task): void {
    const at = this.#queue.findIndex((other) => other.priority > task.priority);
    this.#queue.splice(at < 0 ? this.#queue.length : at, 0, task);
  }

  #next(): void {
    if (!this.#desk.task && this.#deskQueue.length > 0) this.#start(this.#desk, this.#deskQueue.shift()!);
    // From the last worker on: the first one puts simulations together.
    this.#slots.toReversed().forEach((slot) => {
      if (slot.task) return;
      const index = this.#slots.indexOf(slot);
      const at = this.#queue.findIndex(({ place }) => place === null || place === index);
      if (at >= 0) this.#start(slot, this.#queue.splice(at, 1)[0]!);
    });
    // Work waits: do not wait long for what nobody wants any more.
    if (this.#queue.length > 0) for (const slot of this.#slots) this.#hurry(slot, this.#options.impatienceMs);
  }

  #start(slot: Slot, task: Task): void {
    slot.task = task;
    slot.id = ++this.#ids;
    slot.since = Date.now();
    const json = JSON.stringify(task.request);
    // A copy travels, so that the caller keeps its bytes.
    const data = task.data ? task.data.slice() : null;
    slot.worker.postMessage({ id: slot.id, json, data }, data ? [data.buffer as ArrayBuffer] : []);
  }

  #slot(): Slot {
    const slot: Slot = { worker: this.#options.spawn(), task: null, id: 0, since: 0, replace: null };
    this.#listen(slot);
    return slot;
  }

  #listen(slot: Slot): void {
    slot.worker.onmessage = (event) => this.#received(slot, event.data);
    slot.worker.onerror = (event) => this.#broken(slot, event.message || "a worker could not be started");
  }

  #received(slot: Slot, message: FromWorker): void {
    if (!slot.task || message.id !== slot.id) return;
    if ("trap" in message) return this.#broken(slot, message.trap);
    const { task } = slot;
    this.#stillborn = 0;
    this.#free(slot);
    if (task.group.dropped) task.reject(new Dropped());
    else task.resolve({ json: message.json, data: message.data });
    this.#next();
  }

  /// The engine of this worker stopped: the request fails, the next one gets a new worker.
  #broken(slot: Slot, why: string): void {
    const { task } = slot;
    if (!task && ++this.#stillborn > MOST_STILLBORN) return;
    this.#respawn(slot);
    task?.reject(
      new Refused(
        `The engine stopped while it worked on "${task.request.ask}" (${why}). It was started again; please report the link of this page.`,
      ),
    );
    this.#next();
  }

  #respawn(slot: Slot): void {
    this.#free(slot);
    slot.worker.onmessage = null;
    slot.worker.onerror = null;
    slot.worker.terminate();
    slot.worker = this.#options.spawn();
    this.replaced++;
    this.#listen(slot);
  }

  #free(slot: Slot): void {
    if (slot.replace) clearTimeout(slot.replace);
    slot.replace = null;
    slot.task = null;
  }

  #drop(group: Group, then: () => void): void {
    group.dropped = true;
    const waiting = (task: Task) => task.group !== group;
    this.#queue = this.#queue.filter(waiting);
    this.#deskQueue = this.#deskQueue.filter(waiting);
    const { patienceMs, impatienceMs } = this.#options;
    for (const slot of this.#slots) this.#hurry(slot, this.#queue.length > 0 ? impatienceMs : patienceMs);
    then();
  }

  /// Whether a simulation waits for a worker that does what takes longest.
  #isInTheWay(slot: Slot): boolean {
    const place = this.#slots.indexOf(slot);
    const waits = (other: Task) => other.priority < LONGEST && (other.place === null || other.place === place);
    return slot.task?.priority === LONGEST && this.#queue.some(waits);
  }

  /// Replaces the worker `patience` after its task began, if the task is superseded; also, after a
  /// while, if it makes room.
  #hurry(slot: Slot, patience: number): void {
    const { task, id } = slot;
    if (!task || !(task.group.dropped || this.#isInTheWay(slot))) return;
    const ms = !task.group.dropped ? this.#options.asideMs : isCoarse(task.request) ? STUCK_MS : patience;
    if (slot.replace) clearTimeout(slot.replace);
    slot.replace = setTimeout(
      () => {
        if (slot.task !== task || slot.id !== id) return;
        if (!task.group.dropped && !this.#isInTheWay(slot)) return;
        this.#respawn(slot);
        if (task.group.dropped) task.reject(new Dropped());
        else this.#enqueue(task);
        this.#next();
      },
      Math.max(0, slot.since + ms - Date.now()),
    );
  }
}

function isCoarse(request: Request): boolean {
  return (request.ask === "walk" || request.ask === "simulate") && request.rays <= RAYS[0];
}

const LONGEST = 3;

/// 0 goes to the desk; then coarse walks, finer ones, and what takes longest.
function urgency(request: Request): number {
  switch (request.ask) {
    case "walk":
    case "simulate":
      return isCoarse(request) ? 1 : 2;
    case "wedge":
    case "directions":
      return LONGEST;
    default:
      return 0;
  }
}

export function read(reply: { json: string }): unknown {
  const answer = JSON.parse(reply.json) as { error?: unknown; key?: unknown };
  if (typeof answer.error === "string") {
    throw new Refused(answer.error, typeof answer.key === "string" ? answer.key : undefined);
  }
  return answer;
}
