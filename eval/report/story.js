// The story of a run: the first drive is mapped, the map comes right on the roads, the second drive is found in it. No drawing here.

const ROADS_SHARE = 0.15; // of the first drive's length that the map takes to come right: there is room for the part's name
const SETTLING = 6; // so many times slower than the rest, at least, as the localizer finds itself within seconds
const FIND_SHARE = 0.14; // and so much of the first drive's length, at least, for the same reason
const AFTER_FIX_S = 6; // of the second drive that are still told slowly after the first fix
const SECOND = ["find", "settled", "follow"]; // kinds of the segments of the second drive
/** The part of the story that a segment belongs to: the fourth one begins slowly, with the first fix. */
const partOf = (kind) => (kind === "settled" ? "follow" : kind);

/** The layers, drives and segments that the player tells, from the content of map.json and of belief.json (null without one). */
function makeStory(data, second) {
  const names = new Set([...(second ? second.beliefs : []), ...data.drives].map((one) => one.name));
  const colours = Object.fromEntries(data.methods.map((layer, i) => [layer.name, COLOURS[i % COLOURS.length]]));
  const semi = data.methods.find((layer) => layer.name === "semi-metric") || null;
  const refined = data.methods.filter((layer) => names.has(layer.name));
  // A second localizer may have driven in the map of a method: it is a choice beside that one.
  const others = (second ? second.beliefs : []).filter((one) => one.map && refined.some((layer) => layer.name === one.map));
  for (const one of others) colours[one.name] = COLOURS[5];
  const choices = [...others.map((one) => one.name), ...refined.map((layer) => layer.name)];
  return { data, second, colours, semi, refined, choices };
}

/** The map that is shown with a choice. */
function layerOf(story, name) {
  const belief = story.second && story.second.beliefs.find((one) => one.name === name);
  return story.refined.find((one) => one.name === ((belief && belief.map) || name));
}

/** The segments of a story for one of its refined maps: story seconds s0..s1 stand for seconds t0..t1 of a drive. */
function makeSegments(story, name) {
  const segments = [], times = story.data.truth.t_s, drive = secondDrive(story, name);
  const add = (kind, t0, t1, stretch) => {
    const s0 = segments.length ? segments.at(-1).s1 : 0;
    segments.push({ kind, t0, t1, s0, s1: s0 + Math.max(stretch, 0.001) });
  };
  if (times.length > 1) add("map", times[0], times.at(-1), times.at(-1) - times[0]);
  if (story.refined.length && segments.length) add("roads", 0, 1, ROADS_SHARE * segments[0].s1);
  if (drive && drive.t_s.length > 1) {
    const fix = drive.localized.indexOf(true), [t0, t1] = [drive.t_s[0], drive.t_s.at(-1)];
    const found = fix < 0 ? t1 : drive.t_s[fix], slow = Math.min(t1, found + AFTER_FIX_S);
    if (fix < 0) add("find", t0, t1, t1 - t0); // never localized: nothing to be told slowly
    else if (found > t0) add("find", t0, found, Math.max(SETTLING * (found - t0), FIND_SHARE * (segments[0]?.s1 || 0)));
    if (slow > found) add("settled", found, slow, SETTLING * (slow - found));
    if (t1 > slow) add("follow", slow, t1, t1 - slow);
  }
  return segments;
}

/** What the localizer said in one map: the belief if it was kept, else the poses alone. */
function secondDrive(story, name) {
  const among = (list) => list.find((one) => one.name === name) || null;
  return (story.second && among(story.second.beliefs)) || among(story.data.drives);
}

/** The segment at a story time, and the time of the drive there; for "roads" the share from 0 to 1. */
function momentAt(segments, s) {
  const segment = segments.find((one) => s < one.s1) || segments.at(-1);
  const share = Math.min(1, Math.max(0, (s - segment.s0) / (segment.s1 - segment.s0)));
  const t = segment.t0 + share * (segment.t1 - segment.t0);
  return { kind: segment.kind, t: Math.round(1e6 * t) / 1e6 }; // so that a vertex's own time is not an instant before it
}

/** The story time of a time of the first drive (drive 1) or the second (drive 2). */
function storyTime(segments, drive, t) {
  const kinds = drive === 2 ? SECOND : ["map"];
  const own = segments.filter((one) => kinds.includes(one.kind));
  if (!own.length) return 0;
  const one = own.find((segment) => t < segment.t1) || own.at(-1); // the end of one is the begin of the next
  return one.s0 + Math.min(1 - 1e-9, Math.max(0, (t - one.t0) / Math.max(one.t1 - one.t0, 1e-9))) * (one.s1 - one.s0);
}

/** A position on a timed path, linear in time. */
function placeAt(path, t) {
  const i = before(path.t_s, t), j = Math.min(i + 1, path.t_s.length - 1);
  const share = j > i ? Math.min(1, Math.max(0, (t - path.t_s[i]) / (path.t_s[j] - path.t_s[i]))) : 0;
  return [path.x_m[i] + share * (path.x_m[j] - path.x_m[i]), path.y_m[i] + share * (path.y_m[j] - path.y_m[i])];
}

/** Half axes in metres and direction of the ellipse that holds 95 % of a belief; covariance as xx, xy, yy. */
function ellipseOf([xx, xy, yy]) {
  const middle = (xx + yy) / 2, apart = Math.hypot((xx - yy) / 2, xy), within95 = 2.4477;
  const axis = (variance) => within95 * Math.sqrt(Math.max(variance, 0));
  return { a: axis(middle + apart), b: axis(middle - apart), turn: Math.atan2(2 * xy, xx - yy) / 2 };
}

function metres(value) {
  if (value === null || value === undefined) return "no truth near";
  return `${value < 1000 ? value.toFixed(2) : Math.round(value)} m`;
}

/** How far something is from the truth, in words that follow its name. */
const offBy = (verb, value) => (value === null || value === undefined ? "no truth near" : `${verb} ${metres(value)} off`);
