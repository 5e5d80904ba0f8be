/** One of several volumes in a file: an answer that lists them becomes a question. */

/** `series=4 (CT "Thorax", 120 slices)`: parameter, value and what it is. */
const OPTION = /\b(series|channel)=([^\s,]+)(?: \((.*?)\))?(?=, (?:series|channel)=|, and \d+ more|, \.\.\.|\.?$)/g;

/**
 * @typedef {Object} Choice
 * @property {string} question
 * @property {'series' | 'channel'} parameter of the request that is repeated
 * @property {{value: string, label: string}[]} options
 */

/**
 * What an error lets one choose from; null: it is about something else.
 * @param {any} error
 * @returns {Choice | null}
 */
export function choiceOf(error) {
  if (!/(^|\.)(series|channel)$/.test(error?.details?.path ?? '')) return null;
  return choiceIn(error.message);
}

/**
 * The options that a sentence lists.
 * @param {string} sentence
 * @returns {Choice | null}
 */
export function choiceIn(sentence) {
  const found = [...sentence.matchAll(OPTION)];
  if (found.length === 0) return null;
  const parameter = /** @type {any} */ (found[0][1]);
  const options = found.map(([, , value, label]) => ({ value, label: label ? label.replaceAll('`', '') : `${parameter} ${value}` }));
  const question = sentence.slice(0, found[0].index).replace(/^[\w.]+: /, '').replace(/[;:\s]+$/, '');
  return { question, parameter, options };
}

/** Whether the server can read a volume's file once more, as with another choice. @param {any} source */
export const isElsewhere = (source) => Boolean(source?.path || source?.url);

/**
 * A choice as the server takes it: a channel is a number where JSON has numbers.
 * @param {Choice} choice
 * @param {string} value
 */
export const chosen = ({ parameter }, value) => ({ [parameter]: parameter === 'channel' ? Number(value) : value });
