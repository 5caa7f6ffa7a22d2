// The bytes of a frame as an object; `view/src/frame.rs` describes them.

const text = new TextDecoder();

class Reader {
  constructor(view, at, end) { this.view = view; this.at = at; this.end = end; }
  u16() { this.at += 2; return this.view.getUint16(this.at - 2, true); }
  u32() { this.at += 4; return this.view.getUint32(this.at - 4, true); }
  f32() { this.at += 4; return this.view.getFloat32(this.at - 4, true); }
  f64() { this.at += 8; return this.view.getFloat64(this.at - 8, true); }
  many(count, read) { return Array.from({ length: count }, read); }
  f32s(count) { return this.array(Float32Array, count); }
  u32s(count) { return this.array(Uint32Array, count); }
  // Sections start at multiples of 4 bytes, so that an array can lie over them.
  array(Type, count) { this.at += 4 * count; return new Type(this.view.buffer, this.view.byteOffset + this.at - 4 * count, count); }
}

const readers = {
  TIME(r) {
    const [now, end, taken, events, speed, flags] = [r.f64(), r.f64(), r.f64(), r.f64(), r.f32(), r.u32()];
    return { now, end, taken, events, speed, playing: !!(flags & 1), atEnd: !!(flags & 2), live: !!(flags & 4), seeking: !!(flags & 8) };
  },
  EVNT(r) {
    const count = (r.end - r.at) / 8, words = r.u32s(2 * count);
    return { count, words, x: i => words[2 * i] & 0xffff, y: i => words[2 * i] >>> 16, age: i => words[2 * i + 1] >>> 1, on: i => words[2 * i + 1] & 1 };
  },
  NEAR: r => r.u32s((r.end - r.at) / 4),
  WAVE(r) {
    const layers = r.many(r.u32(), () => ({ level: r.u32(), rows: r.u32(), computed: r.u32() }));
    for (const layer of layers) {
      const list = r.u32s(layer.computed);
      layer.list = Array.from(list, word => ({ row: word >>> 1, changed: word & 1 }));
      layer.unchanged = layer.list.filter(row => !row.changed).length;
    }
    return layers;
  },
  CELL: r => r.many(r.u32(), () => {
    const [columns, rows, count] = [r.u32(), r.u32(), r.u32()];
    return { columns, rows, cells: r.many(count, () => ({ x: r.u16(), y: r.u16(), age: r.u32(), value: r.f32() })) };
  }),
  READ(r) {
    const [grids, columns, rows] = [r.u32(), r.u32(), r.u32()];
    return { grids, columns, rows, values: r.f32s(grids * columns * rows) };
  },
  LAYR: r => r.many(r.u32(), () => ({ computed: r.u32(), kept: r.u32(), absorbed: r.u32() })),
  DIFF(r) {
    const [columns, rows] = [r.u32(), r.u32()], words = r.u32s((r.end - r.at) / 4), set = [];
    words.forEach((word, i) => { for (let rest = word; rest; rest &= rest - 1) set.push(32 * i + 31 - Math.clz32(rest & -rest)); });
    return { columns, rows, set };
  },
  PICT(r) {
    const [columns, rows] = [r.u32(), r.u32()];
    return { columns, rows, rgb: new Uint8Array(r.view.buffer, r.view.byteOffset + r.at, 3 * columns * rows) };
  },
  FORC(r) {
    const [columns, rows, x, y, threshold, area] = [r.u32(), r.u32(), r.f32(), r.f32(), r.f32(), r.f32()], values = r.f32s(columns * rows);
    let [most, pixels] = [0, 0];
    for (const value of values) { most = Math.max(most, value); pixels += value > threshold; }
    return { columns, rows, centre: [x, y], threshold, area, values, most, pixels };
  },
  ELEC: r => r.many(r.u32(), () => ({ begins: r.u32(), values: r.f32s(24) })),
  SPAR(r) {
    const [channels, rows, columns] = [r.u32(), r.u32(), r.u32()];
    return { channels, rows, columns, list: r.many((r.end - r.at) / 8, () => [r.u32(), r.f32()]) };
  },
  TIPS(r) {
    const [count, selected, outputs] = [r.u32(), r.u32(), r.u32()];
    const list = r.many(count, () => {
      const [state, p50, p99, took, taken, dropped, lost] = [r.u32(), r.f32(), r.f32(), r.f32(), r.f64(), r.f64(), r.f64()];
      return { state, p50, p99, took, taken, dropped, lost, values: r.f32s(outputs), events: r.u32s(2 * r.u32()) };
    });
    return { selected, list };
  },
  PRED(r) {
    const [outputs, nodes, unlike, took] = [r.u32(), r.u32(), r.f32(), r.f32()];
    return { nodes, unlike, took, values: r.f32s(outputs), truth: r.f32s(outputs) };
  },
  SERS(r) {
    const [outputs, points] = [r.u32(), r.u32()];
    return { outputs, points, numbers: r.f32s(points * (1 + outputs)) };
  },
  LATE(r) {
    const [measured, p50, p99, p999, most, rate] = [r.f64(), r.f32(), r.f32(), r.f32(), r.f32(), r.f32()];
    return { measured, p50, p99, p999, most, rate, buckets: r.u32s(r.u32()) };
  },
  WORK(r) {
    const layers = r.many(r.u32(), () => ({ computed: r.f64(), unchanged: r.f64(), within: r.f64(), kept: r.f64() }));
    const [predictions, reused, cells, cellsUnchanged] = [r.f64(), r.f64(), r.f64(), r.f64()];
    return { layers, predictions, reused, cells, cellsUnchanged };
  },
  INFO: r => json(r),
  FACT: r => json(r),
};

function json(r) {
  return JSON.parse(text.decode(new Uint8Array(r.view.buffer, r.view.byteOffset + r.at, r.end - r.at)));
}

/** The sections of a frame by tag. Unknown ones are left out. */
export function decode(view) {
  const tag = at => text.decode(new Uint8Array(view.buffer, view.byteOffset + at, 4));
  if (view.byteLength < 4 || tag(0) !== "MSN1") throw new Error("not a frame of this page");
  const frame = {};
  for (let at = 4; at < view.byteLength;) {
    const name = tag(at), length = view.getUint32(at + 4, true), start = at + 8;
    if (readers[name]) frame[name] = readers[name](new Reader(view, start, start + length));
    at = start + length;
  }
  return frame;
}
