// What the server keeps, for how long, and how much of it one may have.

/** "7 days", "12 hours", "30 minutes", of a Duration of the contract, such as "604800s". */
function span(text) {
  const seconds = parseFloat(text ?? '0');
  const [unit, size] = [['day', 86400], ['hour', 3600], ['minute', 60], ['second', 1]].find(([, one]) => seconds >= one && seconds % one === 0) ?? ['second', 1];
  const count = Math.round(seconds / size);
  return counted(count, unit);
}

/** 1.5 GB of 1500000000. */
function bytesText(count) {
  const power = Math.min(4, Math.max(0, Math.floor(Math.log10(Math.max(1, count)) / 3)));
  return `${Number((count / 1000 ** power).toPrecision(3))} ${['bytes', 'kB', 'MB', 'GB', 'TB'][power]}`;
}

/** Sentences about how long jobs and meshes are kept, and how much of the quota is used. */
function keepingSentences({limits = {}, ownerBytes}) {
  const {maxEndedJobs = 0, minEndedAge, maxEndedAge, meshLifetime, maxBytesPerOwner} = limits;
  const sentences = [`Ended jobs and their results are kept for ${span(minEndedAge)}, and after that the ${grouped(maxEndedJobs)} that ended last` +
      `${maxEndedAge ? `, for ${span(maxEndedAge)} at most` : ''}. A mesh without a job is kept for ${span(meshLifetime)}.`];
  if (countOf(maxBytesPerOwner) > 0) {
    const used = countOf(ownerBytes);
    sentences.push(`Your meshes and results take ${bytesText(used)}; you may store ${bytesText(countOf(maxBytesPerOwner))}` +
        `${used > 0.9 * countOf(maxBytesPerOwner) ? '. Delete jobs that you do not need' : ''}.`);
  }
  return sentences;
}

/** Adds these sentences to a section when the server has told. */
async function showKeeping(section, signal) {
  const info = await askFor('info', {signal});
  const full = countOf(info.limits?.maxBytesPerOwner) > 0 && countOf(info.ownerBytes) > 0.9 * countOf(info.limits.maxBytesPerOwner);
  section.append(make('p', {id: 'keeping', class: full ? 'lost small' : 'quiet small'}, keepingSentences(info).join(' ')));
}
