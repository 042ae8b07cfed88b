import type { PictureHeader, Reply } from '../messages.ts';

export interface Picture {
  header: PictureHeader;
  bytes: Uint8Array<ArrayBuffer>; // of the JPEG or PNG
}

// Takes a binary message apart: length of the header (32 bit, little endian), header, picture. Throws on anything else.
export function parse_picture(data: ArrayBuffer): Picture {
  if (data.byteLength < 4) throw new Error('a picture without a header');
  const size = new DataView(data).getUint32(0, true);
  if (size > data.byteLength - 4) throw new Error('a picture whose header is cut off');
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size))) as PictureHeader;
  return { header, bytes: new Uint8Array(data, 4 + size) };
}

export const parse_reply = (text: string): Reply => JSON.parse(text) as Reply;

export const picture_blob = ({ header, bytes }: Picture): Blob => new Blob([bytes], { type: `image/${header.format}` });
