// A standard move in TypeScript, for Node 22.18 or newer, which runs it as it is:
// node examples/03_standard_move.ts http://localhost:8090 5.5 7.5
// An older one, from 18 on, runs what `npx esbuild examples/03_standard_move.ts --outfile=move.mjs` makes of it.

type Move = { id: number; state: "moving" | "succeeded" | "failed" | "cancelled"; fail_message: string };

const [url, x, y] = process.argv.slice(2);

async function call(path: string, body?: object): Promise<Move> {
  const options = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  const answer = await fetch(`${url}${path}`, body ? options : {});
  if (!answer.ok) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
  return (await answer.json()) as Move;
}

let move = await call("/chassis/moves", { type: "standard", target_x: Number(x), target_y: Number(y) });
while (move.state === "moving") {
  await new Promise((resolve) => setTimeout(resolve, 200));
  move = await call(`/chassis/moves/${move.id}`);
}
console.log(move.state, move.fail_message);
process.exit(move.state === "succeeded" ? 0 : 1);
