// Reads an MCAP file with @mcap/core in both of its ways, and compares what it holds with our CSV.
//
//     npm ci && node check_recording.cjs [--unfinished] FILE.mcap [TABLE.csv...]
//
// Streaming, every CRC is checked. A file that was closed is read again through its index, and has the
// same messages there; one that was not has only whole records. With a CSV of `beadline impurity` every double in its columns
// time_s, u_<bead>_m and v_<bead>_m_s is that of the /state of the same frame; with one of `beadline energies` those of
// the same name in /summary are equal but for the order of the sum, and every number of /summary is a field with a name, as
// plotting tools want it. Exit code 0 if all is well, 1 if not.

"use strict";

const assert = require("node:assert/strict");
const fs = require("node:fs");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = require("@mcap/support");

/** Pieces of a stream come in sizes that have nothing to do with records. */
const PIECE_BYTES = 65_521;

/** All records of a file that is read as it comes. */
function* stream(path, decompressHandlers, closed) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  const file = fs.openSync(path);
  const piece = new Uint8Array(PIECE_BYTES);
  for (let length; (length = fs.readSync(file, piece)) > 0; ) {
    reader.append(piece.subarray(0, length));
    for (let record; (record = reader.nextRecord()); ) {
      yield record;
    }
  }
  fs.closeSync(file);
  assert.equal(reader.done(), closed, "whether the file was closed");
  assert.equal(reader.bytesRemaining(), 0, "a torn record");
}

/** What a file says, in the order in which it says it. */
function readStreaming(path, decompressHandlers, closed) {
  const found = { schemas: new Map(), channels: new Map(), messages: [], metadata: [], attachments: [] };
  for (const record of stream(path, decompressHandlers, closed)) {
    switch (record.type) {
      case "Header":
        found.header = record;
        break;
      case "Schema":
        found.schemas.set(record.id, record);
        break;
      case "Channel":
        found.channels.set(record.id, record);
        break;
      case "Message":
        // the reader lends its buffer
        found.messages.push({ ...record, data: record.data.slice() });
        break;
      case "Metadata":
        found.metadata.push(record.name);
        break;
      case "Attachment":
        found.attachments.push(record.name);
        break;
    }
  }
  return found;
}

/** The index leads to the same messages, metadata and attachments, in the order of time. */
async function checkIndexed(path, decompressHandlers, found) {
  const handle = await fs.promises.open(path);
  const readable = new FileHandleReadable(handle);
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  assert.equal(reader.header.profile, found.header.profile);
  assert.equal(reader.channelsById.size, found.channels.size);
  assert.equal(reader.schemasById.size, found.schemas.size);
  assert.equal(reader.statistics.messageCount, BigInt(found.messages.length));
  const key = ({ channelId, sequence, logTime, publishTime, data }) =>
    [channelId, sequence, logTime, publishTime, Buffer.from(data).toString("latin1")].join(" ");
  const messages = [];
  let before = 0n;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    assert.ok(message.logTime >= before, "the order of time");
    before = message.logTime;
    messages.push(key(message));
  }
  assert.deepEqual(messages.sort(), found.messages.map(key).sort());
  const names = async (records) => {
    const all = [];
    for await (const record of records) {
      all.push(record.name);
    }
    return all.sort();
  };
  assert.deepEqual(await names(reader.readMetadata()), found.metadata.sort());
  assert.deepEqual(await names(reader.readAttachments({ validateCrcs: true })), found.attachments.sort());
  await handle.close();
}

/** The type of the messages of a protobuf channel, by the schema in the file; and the channel. */
function typeOf(found, topic) {
  const channel = [...found.channels.values()].find((channel) => channel.topic === topic);
  assert.ok(channel, `no channel ${topic}`);
  assert.equal(channel.messageEncoding, "protobuf");
  const schema = found.schemas.get(channel.schemaId);
  return [protobufFromBinaryDescriptor(schema.data).lookupType(schema.name), channel];
}

/** The messages of a protobuf channel. */
function decoded(found, topic) {
  const [type, channel] = typeOf(found, topic);
  return found.messages
    .filter((message) => message.channelId === channel.id)
    .map((message) => ({ logTime: message.logTime, ...type.toObject(type.decode(message.data), { defaults: true }) }));
}

function readTable(path) {
  const lines = fs.readFileSync(path, "utf8").split(/\r?\n/).filter((line) => line && !line.startsWith("#"));
  const names = lines[0].split(",");
  return lines.slice(1).map((line) => Object.fromEntries(line.split(",").map((text, i) => [names[i], text])));
}

/** The columns of the motion of beads, against the states. */
function compareStates(rows, states) {
  const columns = Object.keys(rows[0]).map((name) => [name, /^([uv])_(\d+)_(m|m_s)$/.exec(name)]);
  let compared = 0;
  rows.forEach((row, i) => {
    assert.equal(BigInt(states[i].frame), BigInt(row.frame));
    assert.ok(Object.is(states[i].time_s, Number(row.time_s)), `time of frame ${row.frame}`);
    for (const [name, match] of columns.filter(([, match]) => match)) {
      const values = match[1] === "u" ? states[i].displacement_m : states[i].velocity_m_s;
      assert.ok(Object.is(values[Number(match[2])], Number(row[name])), `${name} of frame ${row.frame}`);
      compared += 1;
    }
  });
  return compared;
}

/** The columns of energies, against the scalars of the same name. */
function compareSummaries(rows, summaries) {
  let compared = 0;
  rows.forEach((row, i) => {
    for (const name of ["kinetic_j", "potential_j", "total_j"]) {
      const [ours, theirs] = [Number(row[name]), summaries[i][name]];
      assert.ok(Math.abs(ours - theirs) <= 1e-12 * Math.abs(ours), `${name} of frame ${row.frame}: ${ours}, ${theirs}`);
      compared += 1;
    }
  });
  return compared;
}

/** Every field of /summary but the list of impurities is one number. */
function checkPlotsAtOnce(found) {
  const [type] = typeOf(found, "/summary");
  const others = type.fieldsArray.filter((field) => field.repeated || !["double", "uint64"].includes(field.type));
  assert.deepEqual(others.map((field) => field.name), ["impurity"]);
}

function compare(found, path) {
  const rows = readTable(path);
  const isEnergies = "kinetic_j" in rows[0];
  if (isEnergies) {
    checkPlotsAtOnce(found);
  }
  const messages = decoded(found, isEnergies ? "/summary" : "/state");
  assert.equal(messages.length, rows.length, `messages, and rows of ${path}`);
  const compared = isEnergies ? compareSummaries(rows, messages) : compareStates(rows, messages);
  assert.ok(compared > 0, `nothing to compare in ${path}`);
  return compared;
}

async function main(words) {
  const closed = words[0] !== "--unfinished";
  const [path, ...tables] = closed ? words : words.slice(1);
  const decompressHandlers = await loadDecompressHandlers();
  const found = readStreaming(path, decompressHandlers, closed);
  assert.ok(found.messages.length > 0, "no messages");
  if (closed) {
    await checkIndexed(path, decompressHandlers, found);
  }
  const compared = tables.map((table) => compare(found, table)).reduce((sum, count) => sum + count, 0);
  const how = closed ? "streaming and indexed" : "streaming";
  console.log(`${path}: ${found.messages.length} messages read ${how}, ${compared} doubles compared`);
}

main(process.argv.slice(2)).catch((error) => {
  console.error(error);
  process.exit(1);
});
