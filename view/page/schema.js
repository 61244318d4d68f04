// What the form needs of the JSON Schema of scenarios (draft 2020-12, the part that `boresight schema` uses).

const isObject = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

/** Words by which a branch of "oneOf" is chosen: those allowed for "type"; null: any. */
function typesOf(branch) {
  const type = branch.properties.type;
  return type.enum || (type.const !== undefined ? [type.const] : null);
}

/** Title of a branch in the list of alternatives. @param {object} branch of "oneOf" */
export const branchName = (branch) => (typesOf(branch) ? typesOf(branch)[0] : branch.title);

/**
 * The schema of a value, with alternatives chosen: "oneOf" by "type" or "plugin", "if" by the key that it requires.
 * @param {object} schema @param {any} value undefined: not given
 */
export function chosen(schema, value) {
  if (schema.oneOf) {
    const type = isObject(value) ? value.type : undefined;
    const plugin = isObject(value) && Object.hasOwn(value, 'plugin');
    return schema.oneOf.find((branch) => (typesOf(branch) ? !plugin && typesOf(branch).includes(type) : plugin)) || schema.oneOf[0];
  }
  if (schema.if) {
    const [key] = schema.if.required, other = isObject(value) && Object.hasOwn(value, key);
    const properties = other ? schema.then.properties : { ...schema.else.properties, [key]: schema.then.properties[key] };
    return { ...schema, properties };
  }
  return schema;
}

/**
 * How a value is edited. "object" and "list" have parts.
 * @returns {'object'|'list'|'numbers'|'choice'|'choices'|'boolean'|'number'|'text'|'json'}
 */
export function kindOf(schema) {
  const types = [schema.type].flat();
  if (schema.enum) return 'choice';
  if (schema.properties || schema.oneOf || schema.if) return 'object';
  if (schema.items && schema.items.enum) return 'choices';
  if (schema.items && schema.items.type === 'number') return 'numbers';
  if (schema.items) return 'list';
  if (types.includes('boolean')) return 'boolean';
  if (types.includes('string')) return 'text';
  if (types.includes('number') || types.includes('integer')) return 'number';
  return 'json';
}

/** Documentation and unit, "... [unit]". @returns {{ text: string, unit: string }} */
export function documented(schema) {
  const text = schema.description || (schema.then ? schema.then.title : '') || '';
  const unit = /^(.*?)\s*\[([^\]]*)\]$/s.exec(text);
  return unit && kindOf(schema) !== 'text' ? { text: unit[1], unit: unit[2] } : { text, unit: '' };
}

/** Allowed values in words; "" without limits. */
export function rangeOf(schema) {
  const of = schema.items && schema.items.type === 'number' ? schema.items : schema;
  const word = (value) => (Math.abs(value) >= 1e6 ? Number(value.toPrecision(6)).toExponential().replace('e+', 'e') : String(value));
  if (kindOf(schema) === 'list') return `${schema.minItems ?? 0} to ${schema.maxItems ?? 'any number'}`;
  if (of.minimum === undefined && of.maximum === undefined) return '';
  if (of.maximum === undefined) return `from ${word(of.minimum)}`;
  return of.minimum === undefined ? `up to ${word(of.maximum)}` : `${word(of.minimum)} to ${word(of.maximum)}`;
}

/** The keys of an object that can be edited. @returns {[string, object][]} */
export function keysOfObject(schema, value) {
  const { properties = {} } = chosen(schema, value);
  return Object.entries(properties).filter(([, child]) => !child.deprecated);
}

/** A first value: what is required, and nothing else. */
export function firstValue(schema) {
  switch (kindOf(schema)) {
    case 'object': {
      const branch = chosen(schema, undefined), made = {};
      for (const key of branch.required || []) made[key] = firstValue(branch.properties[key]);
      return made;
    }
    case 'list': return Array.from({ length: schema.minItems || 0 }, () => firstValue(schema.items));
    case 'numbers': return schema.default ?? new Array(schema.minItems || 1).fill(Math.max(0, schema.items.minimum ?? 0));
    case 'choice': return schema.default ?? schema.enum[0];
    case 'choices': return schema.default ?? [];
    case 'boolean': return schema.default ?? false;
    case 'number': return schema.default ?? Math.min(Math.max(schema.minimum ?? 0, 0), schema.maximum ?? Infinity);
    case 'text': return schema.default ?? schema.const ?? '';
    default: return schema.default ?? {};
  }
}

/**
 * Reads a number as it was typed. "" is null where that is allowed, else undefined: back to the default.
 * @returns {number | string | null | undefined} a string where it is no number: the program says what is wrong
 */
export function numberOf(schema, text) {
  const words = text.trim();
  if (words === '') return [schema.type].flat().includes('null') ? null : undefined;
  const number = Number(words);
  return Number.isFinite(number) ? number : words;
}

/** Reads a text: a seed may be a number. */
export function textOf(schema, text) {
  const seed = [schema.type].flat().includes('integer');
  return seed && /^(0|[1-9][0-9]{0,14})$/.test(text) ? Number(text) : text;
}

/**
 * Goes through all keys of a schema with all alternatives.
 * @param {(way: string[], schema: object) => void} visit way: keys, "*" for an element, ":NAME" for an alternative
 */
export function everyKey(schema, visit, way = []) {
  if (way.length > 0) visit(way, schema);
  for (const branch of schema.oneOf || []) everyKey({ ...branch, isBranch: true }, visit, [...way, `:${branchName(branch)}`]);
  if (schema.oneOf) return;
  const properties = schema.if ? { ...schema.else.properties, ...schema.then.properties } : schema.properties;
  for (const [key, child] of Object.entries(properties || {})) {
    if (!child.deprecated) everyKey(child, visit, [...way, key]);
  }
  if (kindOf(schema) === 'list') everyKey(schema.items, visit, [...way, '*']);
}
