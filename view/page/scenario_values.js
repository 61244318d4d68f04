// Values of a scenario: JSON pointers, and the small file that changes another one (docs/reference, "extends").

/** @typedef {any} Json null, boolean, number, string, list or object of such values */

const isObject = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

/** Keys of a JSON pointer. @param {string} pointer "" or "/a/0" */
export const keysOf = (pointer) => pointer.split('/').slice(1);

/** True for equal values. @param {Json | undefined} a @param {Json | undefined} b @returns {boolean} */
export function same(a, b) {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((value, k) => same(value, b[k]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => Object.hasOwn(b, key) && same(a[key], b[key]));
}

/** Value at a pointer; undefined: none. @param {Json} root @param {string} pointer */
export function valueAt(root, pointer) {
  let value = root;
  for (const key of keysOf(pointer)) {
    if (typeof value !== 'object' || value === null || !Object.hasOwn(value, key)) return undefined;
    value = value[key];
  }
  return value;
}

/** Puts a value at a pointer below the root; missing objects on the way are created. */
export function putAt(root, pointer, value) {
  const keys = keysOf(pointer), last = keys.pop();
  let at = root;
  for (const key of keys) {
    if (typeof at[key] !== 'object' || at[key] === null) setOwn(at, key, {});
    at = at[key];
  }
  setOwn(at, last, value);
}

/** Sets a member; also one called "__proto__" is data. */
function setOwn(object, key, value) {
  Object.defineProperty(object, key, { value, writable: true, enumerable: true, configurable: true });
}

/** Removes the value at a pointer, and objects that are empty then, but no elements of lists. */
export function removeAt(root, pointer) {
  const keys = keysOf(pointer), way = [root];
  for (const key of keys.slice(0, -1)) {
    const next = way.at(-1)[key];
    if (typeof next !== 'object' || next === null) return;
    way.push(next);
  }
  for (let k = keys.length - 1; k >= 0; k--) {
    if (Array.isArray(way[k])) {
      if (k === keys.length - 1) way[k].splice(Number(keys[k]), 1);
      return;
    }
    delete way[k][keys[k]];
    if (k === 0 || Object.keys(way[k]).length > 0) return;
  }
}

/**
 * Values by pointer that turn one document into another by "set". Elements of lists and keys cannot be removed by it:
 * their list or object is replaced as a whole.
 * @returns {Map<string, Json> | null} null: keys of the root were removed
 */
export function differences(before, after) {
  const found = new Map();
  const compare = (a, b, pointer) => {
    if (same(a, b)) return true;
    const objects = isObject(a) && isObject(b) && Object.keys(a).every((key) => Object.hasOwn(b, key) && !key.includes('/'));
    if (objects && Object.keys(b).every((key) => key !== '' && !key.includes('/'))) {
      for (const key of Object.keys(b)) compare(a[key], b[key], `${pointer}/${key}`);
    } else if (Array.isArray(a) && Array.isArray(b) && a.length === b.length) {
      b.forEach((value, k) => compare(a[k], value, `${pointer}/${k}`));
    } else if (pointer === '') {
      return false;
    } else {
      found.set(pointer, b);
    }
    return true;
  };
  return compare(before, after, '') ? found : null;
}

/**
 * The small file: keys of the root as such, all others in "set".
 * @param {string} file that it extends @returns {Json | null} null: it must be a whole file
 */
export function smallFile(file, before, after) {
  const changed = differences(before, after);
  if (!changed) return null;
  const small = { boresight: 1, extends: file }, set = {};
  for (const [pointer, value] of changed) {
    const keys = keysOf(pointer);
    if (keys.length === 1) setOwn(small, keys[0], value); else set[pointer] = value;
  }
  if (Object.keys(set).length > 0) small.set = set;
  return small;
}

/** The values of a small file. @param {Json} before values of the file that it extends @param {Json} small */
export function extended(before, small) {
  const after = structuredClone(before);
  for (const key of Object.keys(small)) {
    if (key !== 'extends' && key !== 'set') setOwn(after, key, structuredClone(small[key]));
  }
  const set = isObject(small.set) ? small.set : {};
  for (const pointer of Object.keys(set)) {
    if (pointer.startsWith('/')) putAt(after, pointer, structuredClone(set[pointer]));
  }
  return after;
}
